"""Weight estimators: one registry, one file a model, one way to train, bundle and compare them."""

from punnet.train.weight.registry import MODELS, FittedWeightModel, ModelSpec, model_spec

__all__ = ["MODELS", "FittedWeightModel", "ModelSpec", "model_spec"]
