!> Squares of a field that vanishes like a square root at the edge of a zone, from its values at the nodes inside.
!>
!> They are smooth across the edge: a paraboloid through those of the nodes nearby, by least squares, says where the edge
!> runs between the nodes, and evens out the errors of single nodes. Lengths are those of the equilateral lattice to which a
!> linear map takes the nodes; a paraboloid stays one.
!>
!> Equations: docs/theory/interior.md, (I16).
module hc_edge_fit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use hc_precision, only: wp
  use hc_options, only: edge_options_t
  use hc_lattice, only: equilateral_basis
  use hc_lapack, only: eliminate
  implicit none
  private

  public :: fit_squares

contains

  !> Replace squares near an edge by those of paraboloids through the squares of nodal values.
  pure subroutine fit_squares(squares, values, distance, options)
    !> Squares that are good to interpolate linearly; those that are not a number stay so (n_col, n_row) [Pa^2]
    real(wp), intent(inout) :: squares(:, :)
    !> Values at the nodes [Pa]
    real(wp), intent(in) :: values(:, :)
    !> Distances from the edge in spacings, positive inside
    real(wp), intent(in) :: distance(:, :)
    !> Tuning numbers
    type(edge_options_t), intent(in) :: options
    integer, parameter :: n_term = 6
    real(wp) :: matrix(n_term, n_term), rhs(n_term, 1), term(n_term), at(2), weight, fitted(size(squares, 1), size(squares, 2))
    integer :: col, row, i, j, reach, n

    fitted = squares
    reach = ceiling(options%fit_reach*2.0_wp/sqrt(3.0_wp))
    do row = 1, size(squares, 2)
      do col = 1, size(squares, 1)
        if (ieee_is_nan(squares(col, row))) cycle
        if (distance(col, row) > options%fit_depth .or. distance(col, row) < -options%fit_beyond) cycle
        matrix = 0.0_wp
        rhs = 0.0_wp
        n = 0
        do j = max(row - reach, 1), min(row + reach, size(squares, 2))
          do i = max(col - reach, 1), min(col + reach, size(squares, 1))
            if (distance(i, j) < options%fit_from) cycle
            at = matmul(equilateral_basis(1.0_wp), real([i - col, j - row], wp))
            if (norm2(at) > options%fit_reach) cycle
            weight = 1.0_wp/(0.3_wp + distance(i, j))
            term = [1.0_wp, at(1), at(2), at(1)**2, at(1)*at(2), at(2)**2]
            matrix = matrix + weight*spread(term, 2, n_term)*spread(term, 1, n_term)
            rhs(:, 1) = rhs(:, 1) + weight*term*values(i, j)*abs(values(i, j))
            n = n + 1
          end do
        end do
        if (n < options%fit_nodes) cycle
        call eliminate(matrix, rhs)
        if (.not. abs(rhs(1, 1)) < huge(1.0_wp)) cycle
        fitted(col, row) = rhs(1, 1)
        if (distance(col, row) < 0.0_wp) fitted(col, row) = min(rhs(1, 1), 0.0_wp)
      end do
    end do
    squares = squares + options%fit_share*(fitted - squares)
  end subroutine fit_squares

end module hc_edge_fit
