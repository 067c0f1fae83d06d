"""Elements that cuts go through: their pieces, and which of these share unknowns."""
