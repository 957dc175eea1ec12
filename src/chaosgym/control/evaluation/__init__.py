"""How good is a way to set the speed? Jobs on the same machines, scores, and how sure they are."""
