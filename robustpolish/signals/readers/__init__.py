"""One reader per file format, each giving a :class:`RawTable`."""
