"""Readings recorded as they arrive: from ports, sockets, buses and growing files to whole files."""
