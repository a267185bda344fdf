// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The sentences about frames with light paths: which of their figures are measured on a
// smaller image, and which lack light paths. Each list is empty for frames without.

import type {Study, StudyLight} from './schema';

export const imageOf = ({shrink, width_px: width, height_px: height}: StudyLight) => shrink > 1 ?
    `an image of ${width} × ${height} pixels, ${shrink} times smaller` :
    'the image itself';

export const wordsOfErrors = ({light}: Study) => light ?
    [
      'Light paths reach every pixel, so their errors and costs are measured on ' + imageOf(light) +
          ', and added to those of paths from the camera at the same number of passes.',
    ] :
    [];

export const wordsOfEffects = ({light}: Study) =>
    light ? ['Times, variances and errors are those of paths from the camera alone.'] : [];

export const wordsOfPaths = ({light}: Study) => light && light.paths_shrink > 1 ?
    ['Paths that begin at lights are measured on an image ' + light.paths_shrink +
     ' times smaller.'] :
    [];
