"""What a camera does to a rendered picture: light, colour, haze, lens, motion, noise, compression.

All of it is drawn once a picture (:func:`draw_effects`) and then applied in the order in which light meets it.
Blur is symmetric and at most a few pixels wide, so that masks stay where they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["NIGHT_CAMERA", "CameraEffects", "apply_effects", "draw_effects", "draw_night_effects"]

_METERED_MEAN = 0.42
_MOST_LIGHT = 1.5  # of the brightest 2% of the picture
_SHOULDER, _BRIGHTEST = 0.7, 2.5


@dataclass(frozen=True)
class CameraEffects:
    """One picture's settings; the defaults leave it as it was rendered.

    Parameters
    ----------
    gain
        (3,) factors of red, green and blue: exposure and white balance.
    metering
        How far the camera by itself corrects the exposure towards a mean of 0.42, 0 to 1.
    saturation
        1 leaves colours, 0 makes them grey.
    gamma
        Exponent of the tones.
    contrast
        Weight of an S-shaped tone curve, 0 to 1; below 0 flattens.
    haze, haze_colour
        Share of veiling light, and its colour (3,) in [0, 1].
    vignette
        How much darker the corners are.
    defocus
        Spread of the blur, pixels.
    motion
        Shift (2,) in pixels, right and down, of the camera while the shutter was open.
    shot_noise, read_noise
        Standard deviation of the noise in 0…255 at full light, and without light.
    jpeg_quality
        Of a first compression inside the camera; None for none.
    """

    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    metering: float = 0.0
    saturation: float = 1.0
    gamma: float = 1.0
    contrast: float = 0.0
    haze: float = 0.0
    haze_colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vignette: float = 0.0
    defocus: float = 0.0
    motion: tuple[float, float] = (0.0, 0.0)
    shot_noise: float = 0.0
    read_noise: float = 0.0
    jpeg_quality: int | None = None


NIGHT_CAMERA = CameraEffects(
    gain=(1.15, 1.12, 1.05), saturation=0.95, vignette=0.3, defocus=0.5, shot_noise=9.0, read_noise=5.0
)
"""A camera under a lamp: the gain is up, and with it the noise."""


def draw_night_effects(rng: np.random.Generator) -> CameraEffects:
    """Draw settings about :data:`NIGHT_CAMERA`: other gains, colours and noise, sometimes out of focus or shaken."""
    exposure, warmth = float(np.exp(rng.normal(0.0, 0.2))), float(np.exp(rng.normal(0.0, 0.05)))
    red, green, blue = NIGHT_CAMERA.gain
    speed = float(abs(rng.normal(0.0, 2.0))) if rng.random() < 0.3 else 0.0
    heading = rng.uniform(0.0, np.pi)
    noise = float(rng.uniform(0.3, 1.3))
    return replace(
        NIGHT_CAMERA,
        gain=(exposure * red * warmth, exposure * green, exposure * blue / warmth),
        saturation=float(rng.uniform(0.8, 1.1)),
        gamma=float(np.exp(rng.normal(0.0, 0.1))),
        contrast=float(rng.uniform(-0.15, 0.3)),
        vignette=float(rng.uniform(0.1, 0.5)),
        defocus=float(rng.uniform(0.3, 0.9)),
        motion=(min(speed, 4.0) * float(np.cos(heading)), min(speed, 4.0) * float(np.sin(heading))),
        shot_noise=noise * NIGHT_CAMERA.shot_noise,
        read_noise=noise * NIGHT_CAMERA.read_noise,
        jpeg_quality=int(rng.integers(50, 90)) if rng.random() < 0.2 else None,
    )


def draw_effects(rng: np.random.Generator) -> CameraEffects:
    """Draw settings: mostly a fair camera in fair light, now and then a poor one."""
    exposure = float(np.exp(rng.normal(0.0, 0.24)))
    warmth, tint = rng.normal(0.0, 0.07), rng.normal(0.0, 0.03)
    speed = float(abs(rng.normal(0.0, 2.2))) if rng.random() < 0.35 else 0.0
    heading = rng.uniform(0.0, np.pi)
    noisy = float(rng.gamma(1.6, 1.0))
    return CameraEffects(
        gain=(
            exposure * float(np.exp(warmth)),
            exposure * float(np.exp(tint)),
            exposure * float(np.exp(-warmth)),
        ),
        metering=float(rng.uniform(0.4, 1.0)),
        saturation=float(rng.uniform(0.62, 1.12)),
        gamma=float(np.exp(rng.normal(0.0, 0.14))),
        contrast=float(rng.uniform(-0.25, 0.45)),
        haze=float(rng.uniform(0.0, 0.22)) if rng.random() < 0.45 else 0.0,
        haze_colour=(
            float(rng.uniform(0.75, 1.0)),
            float(rng.uniform(0.78, 1.0)),
            float(rng.uniform(0.75, 1.0)),
        ),
        vignette=float(rng.uniform(0.0, 0.3)),
        defocus=float(rng.uniform(0.3, 0.75) if rng.random() < 0.75 else rng.uniform(0.75, 1.5)),
        motion=(min(speed, 5.0) * float(np.cos(heading)), min(speed, 5.0) * float(np.sin(heading))),
        shot_noise=min(1.6 * noisy, 9.0),
        read_noise=min(0.6 * noisy, 4.0),
        jpeg_quality=int(rng.integers(45, 90)) if rng.random() < 0.35 else None,
    )


def apply_effects(
    rgb: NDArray[np.uint8], effects: CameraEffects, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Apply ``effects`` to a picture (H, W, 3); ``rng`` draws the noise."""
    picture = _blurred(rgb, effects)
    picture = _developed(picture, effects)
    height, width = picture.shape[:2]
    noise = rng.standard_normal((height, width, 3), dtype=np.float32)
    noise *= cv2.sqrt(picture * np.float32(effects.shot_noise**2) + np.float32(effects.read_noise**2))
    picture *= np.float32(255.0)
    picture += noise
    done = np.asarray(np.clip(picture, 0.0, 255.0) + np.float32(0.5), dtype=np.uint8)
    if effects.jpeg_quality is None:
        return done
    _, encoded = cv2.imencode(".jpg", done, [cv2.IMWRITE_JPEG_QUALITY, effects.jpeg_quality])
    return np.asarray(cv2.imdecode(encoded, cv2.IMREAD_UNCHANGED), dtype=np.uint8)


def _blurred(rgb: NDArray[np.uint8], effects: CameraEffects) -> NDArray[np.float32]:
    """Defocus and motion; light in [0, 1]."""
    picture = rgb.astype(np.float32)
    picture *= np.float32(1.0 / 255.0)
    if effects.defocus > 0:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), effects.defocus), dtype=np.float32)
    reach = float(np.hypot(*effects.motion))
    if reach < 0.5:
        return picture
    half = int(np.ceil(reach / 2.0)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), dtype=np.float32)
    for share in np.linspace(-0.5, 0.5, 33):
        u, v = half + share * effects.motion[0], half + share * effects.motion[1]
        left, top = int(np.floor(u)), int(np.floor(v))
        for row, weight_v in ((top, 1 - (v - top)), (top + 1, v - top)):
            for column, weight_u in ((left, 1 - (u - left)), (left + 1, u - left)):
                kernel[row, column] += weight_u * weight_v
    return np.asarray(cv2.filter2D(picture, -1, kernel / kernel.sum()), dtype=np.float32)


def _developed(picture: NDArray[np.float32], effects: CameraEffects) -> NDArray[np.float32]:
    """Exposure, white balance, saturation, haze and vignetting as one linear map, then the tone curve."""
    weights = np.array((0.299, 0.587, 0.114))
    colour = effects.saturation * np.eye(3) + (1.0 - effects.saturation) * np.tile(weights, (3, 1))
    brightness = max(float(picture.mean()), 0.02)
    metered = float(np.clip((_METERED_MEAN / brightness) ** effects.metering, 0.5, 2.0))
    highlights = max(float(np.quantile(picture[::8, ::8].max(axis=-1), 0.98)), 0.02)
    metered = min(metered, _MOST_LIGHT / highlights / max(effects.gain))
    colour = (1.0 - effects.haze) * metered * np.diag(effects.gain) @ colour
    veil = effects.haze * np.array(effects.haze_colour)
    picture = np.asarray(cv2.transform(picture, np.column_stack((colour, veil)).astype(np.float32)))
    if effects.vignette > 0:
        height, width = picture.shape[:2]
        v = np.linspace(-1.0, 1.0, height, dtype=np.float32)[:, None]
        u = np.linspace(-1.0, 1.0, width, dtype=np.float32)[None, :]
        picture *= (1.0 - np.float32(effects.vignette * 0.5) * (u * u + v * v))[..., None]
    # A table of 4,096 tones is finer than 8 bits and a tenth of the price of powers.
    index = np.clip(picture * np.float32(4095.0 / _BRIGHTEST), 0.0, 4095.0).astype(np.int32)
    return np.asarray(np.take(_tone_curve(effects), index))


def _tone_curve(effects: CameraEffects) -> NDArray[np.float32]:
    """Tones (4096,) for light from 0 to :data:`_BRIGHTEST`: highlights roll off, so that red burns out late."""
    light = np.linspace(0.0, _BRIGHTEST, 4096)
    room = 1.0 - _SHOULDER
    rolled = _SHOULDER + room * (1.0 - np.exp(-(np.maximum(light, _SHOULDER) - _SHOULDER) / room))
    tones = np.where(light < _SHOULDER, light, rolled) ** effects.gamma
    tones += effects.contrast * (tones * tones * (3.0 - 2.0 * tones) - tones)
    return tones.astype(np.float32)
