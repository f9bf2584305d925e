"""``python -m hexcontact`` is the command ``hexcontact``."""

from .cli.app import main

if __name__ == "__main__":
    main()
