"""A model run over a record, freely or led by the data, and what the data then show."""
