// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/image_io.h"

#include <string>

#include <Eigen/Core>

namespace vgtw {

// Few means for pictures that people look at: contact sheets and previews.

// Resampled by area (smaller) or bilinearly (larger); sizes > 0.
RgbImage ResizeImage(const RgbImage& image, int width, int height);

// To a width, with the image's aspect; at least one row.
RgbImage ResizeToWidth(const RgbImage& image, int width);

// A filled, anti-aliased disc; parts outside of the image are left out.
void DrawDisc(const Eigen::Vector2d& centre, double radius_px, const Rgb& color, RgbImage& image);

// One line of text whose lower left corner is at (x, y); `height_px` is that of a capital letter.
void DrawText(
    const std::string& text, int x, int y, double height_px, const Rgb& color, RgbImage& image);

// Copies `image` with its upper left corner at (x, y) of `canvas`; must fit.
void Paste(const RgbImage& image, int x, int y, RgbImage& canvas);

}  // namespace vgtw
