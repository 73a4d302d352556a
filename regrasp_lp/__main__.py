"""Run the command line as ``python -m regrasp_lp``."""

from __future__ import annotations

from regrasp_lp.cli import main

if __name__ == "__main__":
    raise SystemExit(main())
