"""The model of a machine beside a record of it: agreement, and parameters fitted to the record."""
