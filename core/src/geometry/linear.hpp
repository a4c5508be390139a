/// Eigen as the core uses it, for .cpp files only: matrices of fixed size inside one function or
/// between static functions of one file, plain structs at its border.
///
/// Results must not depend on how Eigen orders a sum. So: products, dot products and norms of two
/// terms, where there is but one order; everything coefficient by coefficient; longer sums only of
/// small integers, which are exact in any order. All others are written out. sqrt is vg_sqrt.
///
/// Eigen stands where the code then reads like the mathematics: the end conditions of the quintic
/// (a 3 x 3 solve) and the frames of rectangles. Plain C is better where a vector would only be a
/// pair of doubles (line.c, kinematics.h), in the loops over candidates, which the compiler
/// vectorizes over candidates and not over coordinates (batch.c), and for the banded system of the
/// road's fit, for which Eigen has no solver without a heap (road/fit.c).
#ifndef VG_LINEAR_HPP
#define VG_LINEAR_HPP

#include "base/contract.h"

#if !defined(EIGEN_DONT_VECTORIZE) || !defined(EIGEN_NO_MALLOC) || !defined(EIGEN_NO_DEBUG)
#error "packets reorder sums, matrices may not allocate, all is inlined: see core/CMakeLists.txt"
#endif
#ifndef EIGEN_NO_IO
#define EIGEN_NO_IO
#endif

#include <Eigen/Core>
#include <Eigen/LU>

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// The frame that heads along (cosine, sine): its columns are ahead and left. It takes what is seen
/// from a body to the plane; its transpose takes the plane to the body.
static inline Matrix2d vg_frame(double cosine, double sine)
{
    Matrix2d frame;
    frame << cosine, -sine,
             sine, cosine;
    return frame;
}

#endif
