"""The plant of robust control: its blocks, its loops and its file."""

from robustpolish.models.plant.plant import GeneralizedPlant as GeneralizedPlant
