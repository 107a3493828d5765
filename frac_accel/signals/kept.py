"""What was computed last, for when it is asked for again."""


def kept(store, key, make, *arguments, most=8):
    """What `make` returns, from the dict `store` if it is there; the last few used stay there."""
    if key in store:
        store[key] = store.pop(key)
    else:
        while len(store) >= most:
            del store[next(iter(store))]
        store[key] = make(*arguments)
    return store[key]
