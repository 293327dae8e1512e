"""Pictures that matplotlib draws: where it isn't installed, commands do all else and say what is left out."""

from importlib.util import find_spec

from headless.messages import logger
from synthroads_addon.base.errors import InputError

_INSTALL = "needs the package matplotlib: pip install 'synthroads[ml]'"


def can_draw(name: str) -> bool:
    """Return whether matplotlib is there to draw a picture of this name; if not, note that it is left out."""
    if find_spec("matplotlib") is None:
        logger.info("%s is left out: it %s", name, _INSTALL)
        return False
    return True


def check_drawable(option: str, value: object) -> None:
    """Raise an InputError if pictures are asked for by an option and matplotlib, which draws them, isn't installed."""
    if find_spec("matplotlib") is None:
        raise InputError(option, str(value), _INSTALL)
