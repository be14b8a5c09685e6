"""People of all ages: one topology and one wardrobe, a row of a table for each."""
