"""From an OpenSCENARIO file and its catalogs to plain data: parameters, expressions, errors with their lines."""
