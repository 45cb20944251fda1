"""From surfels to a labelled point cloud: densification, patch labels, edge instances."""
