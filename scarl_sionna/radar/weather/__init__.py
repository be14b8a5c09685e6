"""Weather at millimetre waves: attenuation, scattering by drops and flakes, and their echoes as paths."""
