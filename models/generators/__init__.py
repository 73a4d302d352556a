"""What generate.py writes, a module for each kind of polygon."""
