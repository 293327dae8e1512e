"""Messages that the project logs, whatever commands before set the logger to."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def logged(level: int = logging.WARNING) -> Iterator[list[str]]:
    """Context that collects the messages from a level on in a list."""
    messages: list[str] = []
    logger, handler = logging.getLogger("synthroads"), logging.Handler(level)
    handler.emit = lambda record: messages.append(record.getMessage())  # type: ignore[method-assign]
    before = logger.level
    logger.addHandler(handler)
    logger.setLevel(min(level, before or level))
    try:
        yield messages
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)
