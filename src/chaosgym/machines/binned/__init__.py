"""Machines whose matrices vary with the angle of a drive, held over bins of it, and whose contacts are rows."""
