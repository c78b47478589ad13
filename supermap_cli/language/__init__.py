"""Language: from words to a typed question and back. It knows no map; `query` answers the questions."""
