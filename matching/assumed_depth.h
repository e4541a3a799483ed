// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "scene/view.h"

#include <vector>

namespace vgtw {

// How far away (scene units, > 0) the scene of these views may be, of which only poses are known.
// - Where most viewing axes meet in front of both views (an orbit), it is where they meet.
// - Else (a drive, a drone's rows) photos are assumed to overlap as photographers make them: a view
//   shares three quarters of its picture with its 8th nearest, or its farthest if there are fewer,
//   which a baseline of a quarter of the width of the picture at that depth does.
// 1 if all views are at one place, where depth does not matter. Time grows linearly with the number
// of views; at most 256 of them, spread over the list, are asked. Poses and cameras must be without
// fault.
double AssumedDepth(const std::vector<View>& views);

}  // namespace vgtw
