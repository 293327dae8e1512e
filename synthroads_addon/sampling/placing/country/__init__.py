"""Things beside country roads: signs of curves, towns and bus stops, avenues, entrances to fields."""

from . import signs as signs
