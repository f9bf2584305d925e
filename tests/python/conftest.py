"""What all Python tests need."""

import signal

# A shell that runs tests in the background has them ignore Ctrl-C, and so what they start; some send it.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
