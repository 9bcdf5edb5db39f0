"""The search: which effect is added next, by which law, and what later ones make of earlier ones."""
