"""Mathematics of space, below everything else: rigid motions, cameras, boxes, voxels."""
