"""The roads of an OpenDRIVE map as OpenSCENARIO names places on them, and ways along them."""
