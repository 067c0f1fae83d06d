"""Semi-progressive cutting: elements are split as a tool crosses them through."""
