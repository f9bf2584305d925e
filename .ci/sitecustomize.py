"""Put beside a build of its own, which the finder of an editable install, ahead of PYTHONPATH, would hide."""

import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in type(finder).__module__]
