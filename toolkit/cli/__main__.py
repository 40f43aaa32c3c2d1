"""``python -m autophyx_tet.toolkit.cli``: the command line without the installed script."""

import sys

from .supervisor import main

if __name__ == "__main__":
    sys.exit(main())
