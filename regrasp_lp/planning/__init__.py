"""Planning: search, the path LP, aligning, plans and their verification."""
