"""Arrays of integers: rows that are numbered, lists that are sorted, arrays that grow."""
