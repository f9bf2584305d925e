!> Lattice geometry, coarse lattices and the fields between them.
module test_lattice
  use hc_precision, only: wp
  use hc_error, only: error_t, status
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis, oblique_basis
  use hc_field_space, only: field_space_t
  use hc_transfer, only: prolong, restrict_field
  use testing, only: test_t, new_test, check, check_raised, check_succeeded, check_true
  implicit none
  private

  public :: collect_lattice

  real(wp), parameter :: thr = 1.0e-14_wp

contains

  subroutine collect_lattice(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('equilateral', test_equilateral), &
      new_test('coordinates', test_coordinates), &
      new_test('bad_input', test_bad_input), &
      new_test('coarsened', test_coarsened), &
      new_test('oblique', test_oblique), &
      new_test('rings', test_rings), &
      new_test('periodic', test_periodic), &
      new_test('prolongation', test_prolongation), &
      new_test('prolonged_hat', test_prolonged_hat) &
    ]
  end subroutine collect_lattice

  !> Three edges of equal length; the cell is sqrt(3)/2 of its square, eq. (5.1).
  subroutine test_equilateral(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice

    call new_lattice(lattice, equilateral_basis(3.0_wp), [0, 0], [2, 2], error)
    if (allocated(error)) return
    call check(error, lattice%spacing(), 3.0_wp, thr, 'longest edge')
    if (allocated(error)) return
    call check(error, norm2(lattice%basis(:, 2) - lattice%basis(:, 1)), 3.0_wp, thr, 'third edge')
    if (allocated(error)) return
    call check(error, lattice%cell_area(), 4.5_wp*sqrt(3.0_wp), 9*thr, 'cell area')
  end subroutine test_equilateral

  subroutine test_coordinates(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp) :: x(4, 3), y(4, 3)

    call new_lattice(lattice, equilateral_basis(2.0_wp), [-1, -2], [4, 3], error, origin=[10.0_wp, 20.0_wp])
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    call check(error, [x(2, 3), y(2, 3)], [10.0_wp, 20.0_wp], thr, 'node (0, 0)')
    if (allocated(error)) return
    ! node (2, -1) = 2*(2, 0) - (1, sqrt(3))
    call check(error, [x(4, 2), y(4, 2)], [13.0_wp, 20.0_wp - sqrt(3.0_wp)], 10*thr, 'node (2, -1)')
  end subroutine test_coordinates

  subroutine test_bad_input(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: raised
    type(lattice_t) :: lattice

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [3, 0], raised)
    call check_raised(error, raised, status%invalid_input, 'an empty window')
    if (allocated(error)) return
    call new_lattice(lattice, reshape([1.0_wp, 0.0_wp, 2.0_wp, 0.0_wp], [2, 2]), [0, 0], [3, 3], raised)
    call check_raised(error, raised, status%invalid_input, 'parallel basis vectors')
    if (allocated(error)) return
    call new_lattice(lattice, reshape([0.0_wp, 1.0_wp, 1.0_wp, 0.0_wp], [2, 2]), [0, 0], [3, 3], raised)
    call check_raised(error, raised, status%invalid_input, 'a clockwise basis')
  end subroutine test_bad_input

  !> At a ratio of 1 and 60 degrees the basis is equilateral to the bit; lines are apart by the heights of the cell.
  subroutine test_oblique(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice

    call check(error, reshape(oblique_basis(0.3_wp, 1.0_wp, acos(0.5_wp)), [4]), reshape(equilateral_basis(0.3_wp), [4]), 0.0_wp, &
               'equilateral')
    if (allocated(error)) return
    call new_lattice(lattice, oblique_basis(2.0_wp, 0.5_wp, acos(0.0_wp)), [0, 0], [2, 2], error)
    if (allocated(error)) return
    call check(error, lattice%lines_per_length(), [0.5_wp, 1.0_wp], thr, 'columns and rows per length')
  end subroutine test_oblique

  !> Beyond the end of a window there is nothing: a corner has two neighbors or three.
  subroutine test_rings(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice
    real(wp) :: ones(4, 3)
    logical :: zone(4, 3)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-1, -2], [4, 3], error)
    if (allocated(error)) return
    ones = 1.0_wp
    call check(error, reshape(lattice%ring_sum(ones), [12]), real([3, 5, 5, 4, 5, 7, 7, 5, 4, 5, 5, 3], wp), 0.0_wp, 'sums')
    if (allocated(error)) return
    zone = .false.
    zone(1, 3) = .true.
    call check_true(error, count(lattice%dilated(zone)) == 4 .and. count(lattice%dilated(lattice%dilated(zone))) == 9, &
                    'nodes near a corner')
    if (allocated(error)) return
    call check_true(error, all(lattice%ring_max(merge(2.0_wp, 1.0_wp, zone)) > 1.5_wp .eqv. lattice%dilated(zone)), 'largest')
    if (allocated(error)) return
    call check_true(error, all(lattice%neighbor([1, 3], 5) == [1, 2]) .and. all(lattice%neighbor([1, 3], 4) == 0), 'neighbors')
  end subroutine test_rings

  !> Every node of a window that repeats has six neighbors, so that the sum of all rings is seven times that of the field.
  subroutine test_periodic(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice, coarse
    real(wp) :: field(6, 4), sums(6, 4)
    integer :: i, k, there(2)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [6, 4], error)
    if (allocated(error)) return
    lattice%periodic = .true.
    field = reshape([(real(i**2, wp), i=1, 24)], [6, 4])
    sums = lattice%ring_sum(field)
    call check(error, sum(sums), 7.0_wp*sum(field), thr, 'sum of all rings')
    if (allocated(error)) return
    ! the corner (1, 1) has the neighbors (2, 1), (6, 1), (1, 2), (1, 4), (2, 4) and (6, 2)
    call check(error, sums(1, 1), field(1, 1) + field(2, 1) + field(6, 1) + field(1, 2) + field(1, 4) + field(2, 4) + field(6, 2), &
               thr, 'ring of a corner')
    if (allocated(error)) return
    do k = 1, 6
      there = lattice%neighbor([1, 4], k)
      call check(error, field(there(1), there(2)), lattice_value(lattice%shifted(field, k)), 0.0_wp, 'value of a neighbor')
      if (allocated(error)) return
    end do
    coarse = lattice%coarsened()
    call check_true(error, all(coarse%periodic) .and. all(coarse%extent == [3, 2]), 'half of the nodes repeat, too')

  contains

    real(wp) function lattice_value(shifted)
      real(wp), intent(in) :: shifted(:, :)
      lattice_value = shifted(1, 4)
    end function lattice_value

  end subroutine test_periodic

  !> Every even node of the window, of positive and negative index, and no other.
  subroutine test_coarsened(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice, coarse
    integer :: first, extent

    do first = -4, 3
      do extent = 3, 6
        call new_lattice(lattice, equilateral_basis(1.0_wp), [first, first], [extent, extent], error)
        if (allocated(error)) return
        coarse = lattice%coarsened()
        call check_true(error, 2*coarse%first(1) >= first .and. 2*(coarse%first(1) - 1) < first, 'first coarse node')
        if (allocated(error)) return
        associate (last => 2*(coarse%first(1) + coarse%extent(1) - 1))
          call check_true(error, last <= first + extent - 1 .and. last + 2 > first + extent - 1, 'last coarse node')
        end associate
        if (allocated(error)) return
      end do
    end do
    call check(error, coarse%cell_area(), 4*lattice%cell_area(), thr, 'area of a coarse cell')
  end subroutine test_coarsened

  !> A linear field survives restriction and prolongation inside the coarse window.
  subroutine test_prolongation(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice, coarse
    real(wp) :: x(11, 9), y(11, 9), field(11, 9), back(11, 9)
    real(wp), allocatable :: coarse_field(:, :)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-6, -4], [11, 9], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    field = 1.0_wp + 2.0_wp*x - 3.0_wp*y
    coarse = lattice%coarsened()
    coarse_field = restrict_field(lattice, field, coarse)
    call prolong(coarse, coarse_field, lattice, back, field_space_t())
    call check(error, reshape(back, [99]), reshape(field, [99]), 100*thr, 'linear field')
  end subroutine test_prolongation

  !> A coarse pyramid has half its height at the six fine neighbors of its node.
  subroutine test_prolonged_hat(error)
    type(error_t), allocatable, intent(out) :: error
    type(lattice_t) :: lattice, coarse
    real(wp) :: x(9, 9), y(9, 9), hat(9, 9), coarse_hat(5, 5)

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-4, -4], [9, 9], error)
    if (allocated(error)) return
    coarse = lattice%coarsened()
    coarse_hat = 0.0_wp
    coarse_hat(3, 3) = 1.0_wp
    call prolong(coarse, coarse_hat, lattice, hat, field_space_t())
    call lattice%coordinates(x, y)
    call check(error, reshape(hat, [81]), reshape(merge(1.0_wp, merge(0.5_wp, 0.0_wp, hypot(x, y) < 1.1_wp), &
               hypot(x, y) < 0.1_wp), [81]), thr, 'height at the fine nodes')
  end subroutine test_prolonged_hat

end module test_lattice
