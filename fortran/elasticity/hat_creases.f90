!> Creases of the hat of a lattice node: the segments in which its slope jumps.
!>
!> For each of the three edge directions there are a spoke of double length through the node, with the jump -1/height,
!> and two rims parallel to it, with the jump +1/height. Lengths are in units of the longest edge.
!>
!> Equations: docs/theory/elasticity.md, (E5).
module hc_hat_creases
  use hc_precision, only: wp
  use hc_lattice, only: edge_directions
  implicit none
  private

  public :: crease_t, hat_creases

  !> One family of parallel creases: a spoke through the node and two rims.
  type :: crease_t
    !> Unit direction and unit normal
    real(wp) :: along(2) = 0.0_wp, normal(2) = 0.0_wp
    !> Length of a rim; the spoke is twice as long
    real(wp) :: length = 0.0_wp
    !> Distance of the rims from the node
    real(wp) :: height = 0.0_wp
    !> Abscissa of the center of the rim on the side of the normal
    real(wp) :: skew = 0.0_wp
  end type crease_t

contains

  !> Return the three families of creases.
  pure subroutine hat_creases(basis, crease, edges, spacing, volume)
    !> Basis vectors of the lattice as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    type(crease_t), intent(out) :: crease(3)
    !> Edge directions over the longest edge, as columns
    real(wp), intent(out) :: edges(2, 3)
    !> Longest edge [m]
    real(wp), intent(out) :: spacing
    !> Volume of the hat of unit height, over the longest edge squared
    real(wp), intent(out) :: volume

    real(wp) :: rim(2, 3)
    integer :: q

    edges = edge_directions(basis)
    spacing = maxval(norm2(edges, dim=1))
    edges = edges/spacing
    volume = edges(1, 1)*edges(2, 2) - edges(2, 1)*edges(1, 2)
    ! centers of the rims on the side to which the normals point
    rim(:, 1) = edges(:, 2) - 0.5_wp*edges(:, 1)
    rim(:, 2) = 0.5_wp*edges(:, 2) - edges(:, 1)
    rim(:, 3) = -0.5_wp*(edges(:, 1) + edges(:, 2))
    do q = 1, 3
      crease(q)%length = norm2(edges(:, q))
      crease(q)%along = edges(:, q)/crease(q)%length
      crease(q)%normal = [-crease(q)%along(2), crease(q)%along(1)]
      crease(q)%height = volume/crease(q)%length
      crease(q)%skew = dot_product(rim(:, q), crease(q)%along)
      ! a rim is centered on its spoke exactly where the lattice is equilateral
      if (abs(crease(q)%skew) < 4.0_wp*epsilon(1.0_wp)) crease(q)%skew = 0.0_wp
    end do
  end subroutine hat_creases

end module hc_hat_creases
