"""Radio materials: the table of 76 to 81 GHz, dielectric models, Fresnel coefficients, films of water."""
