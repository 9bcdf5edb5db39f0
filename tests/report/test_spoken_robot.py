"""Lines to type name a robot as the command line takes it."""

from jaxid.cli.arguments import load_robot
from jaxid.report.comparison_page import advice
from jaxid.report.document import Code
from jaxid.report.spoken_robot import spoken
from jaxid.robots import BUILT_IN


def test_built_in_robots_are_called_by_their_names_and_others_by_a_word_to_fill_in():
    for name in BUILT_IN:
        assert load_robot(spoken(name)).name == name
    assert spoken("cart") == "ROBOT"


def test_a_page_does_not_call_a_robot_of_the_users_own_by_its_title(explained):
    class Own:
        robot = type("Robot", (), {"name": "cart"})()
        judgement, free_names, trustworthy = explained.final.judgement, (), True

    lines = [block.text for block in advice([Own()], held_out=False, command=True) if isinstance(block, Code)]
    assert lines == [
        "jaxid fit ROBOT --fit LOGS --held-out OTHER_LOGS --out checked\n"
        "jaxid simulate ROBOT --log LOG --model model.toml --out predicted.csv"
    ]
