"""`docs/foreign.md` from the stored results."""

def page(stored):
    return ""
