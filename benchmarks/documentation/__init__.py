"""Pages and pictures of the documentation that code writes."""
