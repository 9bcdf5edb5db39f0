"""The type checker under which the tests import jaxid: every annotation holds at every call, shapes of arrays included."""

from collections.abc import Hashable
from typing import Self

from beartype import BeartypeConf, FrozenDict, beartype

# An int is a float. jaxtyping decorates methods one by one, so that beartype cannot know the class behind `Self`.
checked = beartype(conf=BeartypeConf(is_pep484_tower=True, hint_overrides=FrozenDict({Self: Hashable})))
