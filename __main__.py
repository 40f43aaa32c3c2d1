"""``python -m autophyx_tet`` is the command ``autophyx-tet``."""

from .toolkit.cli.supervisor import main

if __name__ == "__main__":
    raise SystemExit(main())
