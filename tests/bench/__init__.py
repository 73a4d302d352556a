"""The benchmark of the package: ``python tests/bench --help``."""
