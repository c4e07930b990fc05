"""Contact laws side by side: what the thesis derives, what its listings do, what is well posed."""
