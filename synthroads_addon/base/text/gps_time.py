"""GPS time of a moment in UTC, as LAS files hold it."""

from datetime import UTC, datetime

ADJUSTMENT = 1e9
"""Seconds by which adjusted standard GPS time is less than GPS time. Source: LAS 1.4 R15, table 4."""
LEAP_SECONDS = 18.0
"""Seconds by which GPS time is ahead of UTC since `_SINCE`. Source: IERS Bulletin C: no leap second since then."""
_SINCE = datetime(2017, 1, 1, tzinfo=UTC)
_EPOCH = datetime(1980, 1, 6, tzinfo=UTC)


def gps_seconds(text: str) -> float:
    """Return the seconds since the epoch of GPS of a moment in UTC.

    Args:
        text: ISO 8601, e.g. 2026-05-04T09:30:00Z; without an offset it is UTC.

    Raises:
        ValueError: it is no such moment, or lies before 2017.

    Example:
        >>> gps_seconds("2017-01-01T00:00:00Z")
        1167264018.0
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError("must be a time such as 2026-05-04T09:30:00Z") from None
    moment = moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    if moment < _SINCE:
        raise ValueError("must not lie before 2017-01-01: leap seconds were others then")
    return (moment - _EPOCH).total_seconds() + LEAP_SECONDS
