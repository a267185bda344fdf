# Copyright the Sheaf authors.
# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers, by Cycles' definition: what the camera sees of a catcher becomes the part of the
background's light that the other objects leave, by three images of the same random numbers.
"""
import numpy

UNSEEN, ALONE = "unseen", "alone"  # See scene_export.Settings.catchers.


def composed(whole, unseen, alone, covered, sky):
    """(height, width, 4), premultiplied: the objects over the shadows.

    whole: the image with catchers as usual objects; unseen: with catchers that the camera does not
    see; alone: of the catchers without other objects; each is (colors without sky, alpha). covered:
    the part of each pixel in which the camera meets a catcher; sky: what the camera sees behind, or
    None for transparent film.
    """
    covered = numpy.minimum(covered, whole[1])
    front = whole[1] - covered  # The unseen image has the objects behind, too.
    objects = unseen[0] * _ratio(front, unseen[1], 0.0)[..., None]
    lit = alone[0] * _ratio(covered, alone[1], 0.0)[..., None]
    left = _ratio(whole[0] - objects, lit, 1.0)
    left[covered <= 0] = 1
    behind = whole[1][..., None]
    left = numpy.clip(((1 - behind) + behind * left).mean(axis=-1), 0, 1)
    alpha = front + (1 - front) * (1 - left)
    if sky is None:
        return numpy.concatenate([objects, alpha[..., None]], axis=-1)
    objects = objects + sky * (1 - alpha[..., None])
    return numpy.concatenate([objects, numpy.ones_like(behind)], axis=-1)


def without_sky(combined, alpha, sky):
    """(colors, alpha) for composed(), of an image before anything else is taken out of it."""
    return combined[..., :3] - (1 - alpha[..., None]) * sky, alpha


def _ratio(part, whole, usual):
    """part / whole; usual where the whole is 0."""
    is_known = whole > 1e-8
    return numpy.where(is_known, part / numpy.where(is_known, whole, 1), usual)
