// The arithmetic of the truth.
#pragma once

#include <boost/multiprecision/eigen.hpp>
#include <boost/multiprecision/mpfr.hpp>

namespace ball_sim::core::chart {

/// 77 decimal digits: a significand of 257 bits.
using Multiprecision = boost::multiprecision::number<
    boost::multiprecision::mpfr_float_backend<77, boost::multiprecision::allocate_stack>,
    boost::multiprecision::et_off>;

}  // namespace ball_sim::core::chart
