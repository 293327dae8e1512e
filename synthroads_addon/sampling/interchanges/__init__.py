"""Interchanges drawn on a motorway."""
