"""Folders of images or point clouds with labels beside them: COCO, YOLO, KITTI."""
