"""Programs of others that judge the files SynthRoads writes: which there are, and whether each is here.

A test asks for a judge by `require`; ``python -m tests.judges`` has all of them judge one small road.
"""

from tests.judges.registry import JUDGES, Judge, require

__all__ = ["JUDGES", "Judge", "require"]
