"""Functions that worker processes of the tests import."""


def with_state(model):
    return model.linearize(measured="state")


def roughness(response):
    return {"rms": float((response["x"] ** 2).mean() ** 0.5)}
