"""Bodies that bend: skeletons, the skins around them, and the motion that files record of them."""
