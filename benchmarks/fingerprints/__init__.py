"""A picture for every mechanism of the catalogue: what it does to a motion, and what what is missing then depends on."""
