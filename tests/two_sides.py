"""Dry friction of two wheels on one body, as impulses that stop each where they may: projected Gauss-Seidel."""


def stopping(right, left, own, other, most):
    """The impulses on the right and the left wheel of these speeds, each `most` at most, of which one changes its wheel's speed
    by `own` times its size and the other's by `other` times."""
    on_right = on_left = 0.0
    for _ in range(30):
        before = on_right, on_left
        on_right = min(max(-(right + other * on_left) / own, -most), most)
        on_left = min(max(-(left + other * on_right) / own, -most), most)
        if before == (on_right, on_left):
            break
    return on_right, on_left
