"""Everything that needs PyTorch (``pip install punnet[train]``): networks, training, export to bundles."""

__all__: list[str] = []
