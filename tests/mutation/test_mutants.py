"""The mutants are mistakes, each has a name of its own, and every survivor that is explained exists."""

import ast
import tomllib
from collections import Counter

from tests.mutation.mutants import mutants
from tests.mutation.run import MODULES, SURVIVORS, all_mutants

SOURCE = '''
"""Said."""
LIMIT = 2.0

class Gate:
    """Said too."""

    def open(self, x, y):
        """And this."""
        if x < LIMIT and not y:
            self.count += 1
            return "open"
        return f"{x} is {y}"
'''


def test_every_family_and_nothing_of_what_is_only_said():
    found = list(mutants("gate", SOURCE))
    families = Counter(one.family for one in found)
    assert families == {
        "constant": 5, "deleted": 2, "comparison": 1, "boundary": 1, "logic": 3, "negation": 2, "arithmetic": 1,
        "return": 2,
    }  # fmt: skip
    whole = ast.dump(ast.parse(SOURCE))
    changed = {ast.dump(one.tree()) for one in found}
    assert whole not in changed
    assert len(changed) == len(found)
    assert {one.scope for one in found} == {"", "Gate.open"}
    assert "gate: Gate.open: x < LIMIT -> x <= LIMIT" in {one.key for one in found}


def test_every_mutant_of_the_guard_has_a_name_and_every_explanation_a_mutant():
    keys = [one.key for one in all_mutants()]
    assert len(keys) == len(set(keys)) > 1400
    assert {key.split(":")[0] for key in keys} == set(MODULES)
    explained = tomllib.loads(SURVIVORS.read_text())["survivors"]
    assert set(explained) <= set(keys), sorted(set(explained) - set(keys))
    assert all(reason.strip() for reason in explained.values())
