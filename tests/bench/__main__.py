"""``python tests/bench`` and ``python -m tests.bench`` are the same command."""

from __future__ import annotations

import sys
from pathlib import Path

# The folder above holds this package, and what the tests have in common.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench.command import main

if __name__ == "__main__":
    raise SystemExit(main())
