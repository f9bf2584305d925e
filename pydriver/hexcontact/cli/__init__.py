"""The command ``hexcontact``."""
