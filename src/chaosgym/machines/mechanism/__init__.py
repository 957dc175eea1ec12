"""Any planar mechanism of links and joints, of which some have clearance (thesis chapter 2)."""
