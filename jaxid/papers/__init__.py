"""What both papers did, step by step, on top of the library; nothing in the library imports from here."""
