"""Recordings of any recorder: files in, one reading a cycle out, and the verdict on it; they know no machine."""
