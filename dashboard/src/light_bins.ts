// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Histograms of images, as a worker counts them and the page draws them.

// Counts of pixels. Light has red, green and blue over log2 of the value, from LOG_LOW to LOG_HIGH
// in LOG_BINS bins a stop. False colors have one row over the colors from low to high.
export interface Histogram {
  counts: Uint32Array[];
  isLight: boolean;
  // As sheaf render --exposure auto chooses them; 0 for false colors.
  automaticStops: number;
}

export const LOG_LOW = -12;
export const LOG_HIGH = 8;
export const LOG_BINS = 8;
