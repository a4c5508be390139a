/// Eigen as the core uses it, for .cpp files only: matrices of fixed size inside one function or
/// between static functions of one file, plain structs at its border.
///
/// Results must not depend on how Eigen orders a sum. So: products, dot products and norms of two
/// terms, where there is but one order; everything coefficient by coefficient; longer sums only of
/// small integers, which are exact in any order. All others are written out. sqrt is vg_sqrt.
#ifndef VG_LINEAR_HPP
#define VG_LINEAR_HPP

#include "base/contract.h"

#if !defined(EIGEN_DONT_VECTORIZE) || !defined(EIGEN_NO_MALLOC)
#error "packets reorder sums and matrices may not allocate: see core/CMakeLists.txt"
#endif
#ifndef EIGEN_NO_IO
#define EIGEN_NO_IO
#endif
#define eigen_assert(condition) VERGE_ASSERT(condition) // the library has one way out

#include <Eigen/Core>
#include <Eigen/LU>

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// z of the cross product: the area a and b span, positive where b lies to the left of a.
static inline double vg_cross(const Vector2d& a, const Vector2d& b)
{
    return a.x() * b.y() - a.y() * b.x();
}

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
