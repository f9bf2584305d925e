!> Fields and packed ones: whatever the number of threads, the same bits.
module test_vectors
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan, ieee_positive_inf, ieee_negative_inf
  use, intrinsic :: iso_c_binding, only: c_intptr_t
  use, intrinsic :: iso_fortran_env, only: int64
  use hc_precision, only: wp, sp, lk, zk
  use hc_field_space, only: field_space_t, space_over, most_threads
  use hc_error, only: error_t
  use hc_lapack, only: eliminate
  use hc_coulomb, only: coulomb_t
  use hc_disc_law, only: cone_row
  use hc_frame_rows, only: slip_compliance_row, turn_row, plane_row, add_springs_row, take_off_row
  use hc_contact_residuals, only: normal_residual
  use hc_contact_state, only: separated, stick, slip
  use hc_active_set, only: active_set_t, new_active_set, find_span
  use hc_scratch, only: scratch_t
  use testing, only: test_t, new_test, check, check_true, largest
  !$ use omp_lib, only: omp_get_max_threads
  implicit none
  private

  public :: collect_vectors

  !> One thread.
  type(field_space_t), parameter :: alone = field_space_t()

contains

  subroutine collect_vectors(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('field_space', test_field_space), &
      new_test('odd_fields', test_odd_fields), &
      new_test('threads_of_windows', test_threads), &
      new_test('packing', test_packing), &
      new_test('pairs', test_pairs), &
      new_test('rows_like_nodes', test_rows), &
      new_test('linearized_rows', test_linearized_rows), &
      new_test('frames', test_frames), &
      new_test('not_finite', test_not_finite), &
      new_test('springs', test_springs), &
      new_test('elimination', test_elimination), &
      new_test('scratch', test_scratch) &
    ]
  end subroutine collect_vectors

  !> A vector of more than two blocks whose elements are nothing round.
  pure function sample(n)
    integer, intent(in) :: n
    real(wp) :: sample(n)
    integer :: i
    sample = [(sin(1.7_wp*i) + 0.3_wp*cos(0.9_wp*i*i), i=1, n)]
  end function sample

  !> A first pivot of zero takes an exchange of rows; dependent rows leave a pivot of zero.
  subroutine test_elimination(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: a(3, 3), x(3, 2), b(3, 2)
    integer :: i

    a = reshape([0.0_wp, 2.0_wp, -1.0_wp, 3.0_wp, 0.5_wp, 4.0_wp, 1.0_wp, -2.0_wp, 7.0_wp], [3, 3])
    x = reshape([1.0_wp, -2.0_wp, 0.25_wp, 5.0_wp, 0.0_wp, -3.0_wp], [3, 2])
    b = matmul(a, x)
    call eliminate(a, b)
    call check_true(error, all(abs(b - x) < 1.0e-14_wp), 'solution of three equations')
    if (allocated(error)) return
    a = spread([1.0_wp, 2.0_wp, 3.0_wp], 2, 3)
    b = x
    call eliminate(a, b)
    call check_true(error, any([(abs(a(i, i)) <= 0.0_wp, i=1, 3)]), 'dependent equations')
  end subroutine test_elimination

  !> Sums, products and extrema do not depend on the number of threads, and are right.
  subroutine test_field_space(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 10001
    type(field_space_t) :: space
    real(wp) :: x(n), y(n), b(n, 2), window(73, 137)
    integer :: i

    x = sample(n)
    b(:, 1) = x**2
    b(:, 2) = 1.0_wp - x
    window = reshape(x, shape(window))
    do i = 1, 3
      space = field_space_t(threads=i)
      call check(error, space%sum(x), sum(x), 1.0e-12_wp, 'sum')
      if (allocated(error)) return
      call check(error, space%sum(window), sum(x), 1.0e-12_wp, 'sum over a window')
      if (allocated(error)) return
      call check_true(error, abs(space%sum(x) - alone%sum(x)) <= 0.0_wp, 'the sum does not depend on threads')
      if (allocated(error)) return
      call check_true(error, abs(space%sum(window) - alone%sum(window)) <= 0.0_wp, 'nor does that over a window')
      if (allocated(error)) return
      call check_true(error, abs(space%dot(x, b(:, 1)) - alone%dot(x, b(:, 1))) <= 0.0_wp, 'nor does a product')
      if (allocated(error)) return
      call check(error, space%dot(x, b(:, 1)), sum(x**3), 1.0e-12_wp, 'product')
      if (allocated(error)) return
      call check(error, largest(space%dots(b, x) - matmul(x, b)), 0.0_wp, 1.0e-10_wp, 'products')
      if (allocated(error)) return
      call check(error, space%max(x), maxval(x), 0.0_wp, 'largest')
      if (allocated(error)) return
      call check(error, space%max(-abs(x) - 1.0_wp), -minval(abs(x)) - 1.0_wp, 0.0_wp, 'largest of negative numbers')
      if (allocated(error)) return
      call check(error, space%max(-abs(window) - 1.0_wp), -minval(abs(window)) - 1.0_wp, 0.0_wp, 'the same over a window')
      if (allocated(error)) return
      call check_true(error, space%count(logical(x > 0.2_wp, lk)) == count(x > 0.2_wp), 'number of nodes')
      if (allocated(error)) return
      call space%fill(y, 0.25_wp)
      call space%add(x, y)
      call space%add_columns(b, [2.0_wp, -3.0_wp], y)
      call check(error, largest(y - (0.25_wp + x + 2.0_wp*b(:, 1) - 3.0_wp*b(:, 2))), 0.0_wp, 1.0e-14_wp, 'combination')
      if (allocated(error)) return
      call space%copy(x, y)
      call check(error, largest(y - x), 0.0_wp, 0.0_wp, 'copy')
      if (allocated(error)) return
    end do
    y = [(real(i, wp), i=1, n)]
    call check(error, space%dot(y, y), 10001.0_wp*10002.0_wp*20003.0_wp/6.0_wp, 1.0e-3_wp, 'sum of squares')
  end subroutine test_field_space

  !> Sums of fields in single precision lose nothing that double precision has; fields without nodes have sums, too.
  subroutine test_odd_fields(error)
    type(error_t), allocatable, intent(out) :: error
    real(sp) :: field(300, 2)
    real(wp) :: none(0), no_window(0, 3), no_columns(4, 0)

    field = 1.0_sp
    field(1, :) = 1.0e9_sp
    call check(error, alone%sum(field), 2.0e9_wp + 598.0_wp, 0.0_wp, 'single precision')
    if (allocated(error)) return
    call check(error, [alone%sum(none), alone%sum(no_window), alone%dot(none, none)], spread(0.0_wp, 1, 3), 0.0_wp, 'nothing')
    if (allocated(error)) return
    call check_true(error, max(alone%max(none), alone%max(no_window)) <= -huge(1.0_wp), 'largest of nothing')
    if (allocated(error)) return
    call check_true(error, alone%count(logical(none > 0.0_wp, lk)) == 0, 'no nodes')
    if (allocated(error)) return
    call check_true(error, size(alone%dots(no_columns, [1.0_wp, 2.0_wp, 3.0_wp, 4.0_wp])) == 0, 'no products')
  end subroutine test_odd_fields

  !> A number of threads that is asked for is taken; else small fields have one.
  subroutine test_threads(error)
    type(error_t), allocatable, intent(out) :: error
    type(field_space_t) :: space
    integer :: three

    three = 1
    !$ three = 3
    space = space_over([4, 5], 3)
    call check_true(error, space%threads == three, 'as many as asked for')
    if (allocated(error)) return
    call check_true(error, space%threads_for(20) == 1 .and. space%threads_for(10**6) == three, 'one for a small field')
    if (allocated(error)) return
    space = space_over([4, 5], 0)
    call check_true(error, space%threads == 1, 'one for a small window')
    if (allocated(error)) return
    three = 1
    !$ three = min(omp_get_max_threads(), most_threads)
    space = space_over([400, 500])
    call check_true(error, space%threads == three, 'as many as OpenMP would take')
  end subroutine test_threads

  !> Runs that begin and end anywhere, also across the blocks that threads look through.
  subroutine test_packing(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 20011
    type(active_set_t) :: packing
    logical(lk) :: active(n)
    real(wp) :: x(n), back(n)
    real(wp), allocatable :: packed(:)
    integer :: pattern, threads

    x = sample(n)
    do pattern = 1, 5
      select case (pattern)
      case (1)
        active = x > 0.2_wp
      case (2)
        active = .true.
      case (3)
        active = .false.
      case (4)
        ! one run from end to end but for its ends
        active = .true.
        active([1, n]) = .false.
      case default
        ! single nodes at the ends of blocks
        active = .false.
        active([1, 8192, 8193, 16384, n]) = .true.
      end select
      do threads = 1, 2
        call new_active_set(packing, active, field_space_t(threads))
        call check_true(error, packing%n_active == count(active), 'number of active nodes')
        if (allocated(error)) return
        call check_true(error, sum(packing%last - packing%first + 1) == count(active), 'length of the runs')
        if (allocated(error)) return
        if (allocated(packed)) deallocate (packed)
        allocate (packed(packing%n_active))
        call packing%pack(x, packed)
        call check_true(error, all(abs(packed - pack(x, active)) <= 0.0_wp), 'packed values')
        if (allocated(error)) return
        back = -7.0_wp
        call packing%unpack(packed, back)
        call check_true(error, all(abs(back - merge(x, -7.0_wp, active)) <= 0.0_wp), 'values put back')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_packing

  !> Each active node of the first component is in one run, with its place, and with that of the second component if it has one.
  subroutine test_pairs(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 3001
    type(active_set_t) :: nodes
    logical(lk) :: active(2*n)
    integer :: place(2*n), found(2*n), k, i, low, high

    active(:n) = sample(n) > -0.3_wp
    active(n + 1:) = active(:n) .and. cshift(sample(n), 7) > 0.0_wp
    place = 0
    k = 0
    do i = 1, 2*n
      if (i == n + 1) k = 0
      if (.not. active(i)) cycle
      k = k + 1
      place(i) = k
    end do
    call new_active_set(nodes, active, alone)
    call nodes%pair(2*n)
    found = 0
    associate (runs => nodes%pairs)
      do k = 1, size(runs%first)
        do i = runs%first(k), runs%last(k)
          found(i) = runs%place(k) + i - runs%first(k)
          if (runs%second(k) > 0) found(n + i) = runs%second(k) + i - runs%first(k)
        end do
      end do
      call check_true(error, all(found == place) .and. runs%n_first == count(active(:n)), 'places')
    end associate
    if (allocated(error)) return
    call find_span(active(:n), low, high)
    call check_true(error, low == findloc(active(:n), .true., dim=1) .and. high == findloc(active(:n), .true., 1, back=.true.), &
                    'span')
    if (allocated(error)) return
    call find_span([-1.0_wp, 0.0_wp, 2.0_wp, -3.0_wp, 4.0_wp, 0.0_wp], low, high)
    call check_true(error, low == 3 .and. high == 5, 'span of values above zero')
    if (allocated(error)) return
    call find_span([logical(lk) :: .false., .false.], low, high)
    call check_true(error, low == 1 .and. high == 0, 'no span')
  end subroutine test_pairs

  !> A row is linearised as (F6) says; without slip all nodes in contact stick, without any bound those without a traction.
  subroutine test_linearized_rows(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 301
    real(wp), parameter :: mu = 0.4_wp, r = 2.0e12_wp
    type(coulomb_t) :: law
    real(wp), dimension(n) :: p, qx, qy, dsx, dsy, compliance
    real(wp) :: direction(2, n), d(2), e(2), spring
    integer(zk) :: zone(n), expected
    integer :: i
    logical :: contact(n)

    p = 1.0e9_wp*sample(n)
    contact = p > 0.0_wp
    qx = 0.3_wp*p*cos(sample(n))
    qy = 0.4e9_wp*sample(n)**2
    dsx = 1.0e-4_wp*sample(n)
    dsy = 1.0e-4_wp*sample(n)*qx/p
    law%coefficient = mu
    call law%linearize(1, maxval(p), r, contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
    do i = 1, n
      d = [qx(i), qy(i)] - r*[dsx(i), dsy(i)]
      expected = separated
      e = [1.0_wp, 0.0_wp]
      spring = 0.0_wp
      if (contact(i)) expected = stick
      if (contact(i) .and. norm2(d) > mu*p(i)) then
        expected = slip
        e = d/norm2(d)
        spring = (norm2(d) - mu*p(i))/(r*mu*p(i))
      end if
      call check_true(error, zone(i) == expected, 'zone')
      if (allocated(error)) return
      call check(error, norm2(direction(:, i) - e), 0.0_wp, 1.0e-15_wp, 'direction')
      if (allocated(error)) return
      call check(error, compliance(i), spring, 1.0e-12_wp*spring, 'compliance')
      if (allocated(error)) return
    end do
    law%no_slip = .true.
    call law%linearize(1, maxval(p), r, contact, p, qx, qy, dsx, dsy, zone, direction, compliance)
    call check_true(error, all(zone == merge(stick, separated, contact)) .and. .not. any(compliance > 0.0_wp), 'no slip')
    if (allocated(error)) return
    law = coulomb_t(0.0_wp)
    qx(:9) = 0.0_wp
    qy(:9) = 0.0_wp
    contact = .true.
    call law%linearize(1, maxval(p), 0.0_wp*r + 1.0_wp, contact, p, qx, qy, 0.0_wp*dsx, 0.0_wp*dsy, zone, direction, compliance)
    call check_true(error, all(zone(:9) == stick) .and. all(zone(10:) == slip), 'no friction')
  end subroutine test_linearized_rows

  !> Into the frames and back again; the springs of slipping nodes are added and taken off.
  subroutine test_frames(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 7
    real(wp), dimension(n) :: x, y, t, e, u, v, compliance
    real(wp) :: direction(2, n), largest_stretch

    x = sample(n)
    y = cos(x)
    compliance = max(sample(n), 0.0_wp)
    direction(1, :) = cos(3.0_wp*y)
    direction(2, :) = sin(3.0_wp*y)
    call plane_row(n, direction, x, y, t, e)
    call check(error, largest(t - (-direction(2, :)*x + direction(1, :)*y)), 0.0_wp, 1.0e-15_wp, 'along t')
    if (allocated(error)) return
    call check(error, largest(e - (direction(1, :)*x + direction(2, :)*y)), 0.0_wp, 1.0e-15_wp, 'along e')
    if (allocated(error)) return
    u = x
    v = y
    call add_springs_row(n, direction, compliance, y, u, v)
    call check(error, largest(u - t - compliance*y) + largest(v - e), 0.0_wp, 1.0e-15_wp, 'with springs')
    if (allocated(error)) return
    largest_stretch = 0.0_wp
    call take_off_row(n, compliance, y, u, largest_stretch)
    call check(error, largest_stretch, maxval(abs(compliance*y)), 0.0_wp, 'largest stretch')
    if (allocated(error)) return
    call turn_row(n, direction, u, v)
    call check(error, largest(u - x) + largest(v - y), 0.0_wp, 4.0e-15_wp, 'there and back')
  end subroutine test_frames

  !> A number that is not finite makes R_n infinite, but a gap where nothing can touch is not looked at.
  subroutine test_not_finite(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: pressure(5, 3), gap(5, 3), wrong(3)
    logical :: candidate(5, 3)
    integer :: k, i

    wrong = [ieee_value(1.0_wp, ieee_quiet_nan), ieee_value(1.0_wp, ieee_positive_inf), ieee_value(1.0_wp, ieee_negative_inf)]
    candidate = .true.
    candidate(5, 3) = .false.
    pressure = 0.0_wp
    pressure(2:4, 2) = [1.0_wp, 2.0_wp, 1.0_wp]
    do k = 1, size(wrong)
      gap = merge(0.0_wp, 1.0_wp, pressure > 0.0_wp)
      gap(5, 3) = wrong(k)
      gap(4, 2) = 0.25_wp
      ! the largest finite numbers are finite
      gap(1, 1) = huge(1.0_wp)
      call check(error, normal_residual(pressure, gap, candidate, 1.0_wp, alone), 0.125_wp, 1.0e-15_wp, 'where nothing can touch')
      if (allocated(error)) return
      do i = 1, 5
        gap(i, 2) = wrong(k)
        call check_true(error, normal_residual(pressure, gap, candidate, 1.0_wp, alone) >= huge(1.0_wp), 'gap')
        if (allocated(error)) return
        gap(i, 2) = 1.0_wp
        pressure(i, 1) = wrong(k)
        call check_true(error, normal_residual(pressure, gap, candidate, 1.0_wp, alone) >= huge(1.0_wp), 'pressure')
        if (allocated(error)) return
        pressure(i, 1) = 0.0_wp
      end do
    end do
  end subroutine test_not_finite

  !> Passes over a row say what the law of friction says node by node.
  subroutine test_rows(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 301
    type(coulomb_t), parameter :: no_slip = coulomb_t(no_slip=.true.)
    real(wp), parameter :: mu = 0.4_wp, r = 2.0e12_wp, compliance = 3.0e-13_wp
    type(coulomb_t), parameter :: law = coulomb_t(mu)
    real(wp), dimension(n) :: p, qx, qy, dsx, dsy, cut_x, cut_y
    integer(zk) :: zone(n), expected
    integer :: i
    real(wp) :: unit, largest, worst, q(2), ds(2), cut(2), lack

    p = 1.0e9_wp*sample(n)
    qx = 0.3_wp*p*cos(sample(n))
    qy = 0.4e9_wp*sample(n)**2
    dsx = 1.0e-4_wp*sample(n)
    dsy = 1.0e-4_wp*sample(n)*qx/p
    unit = 1.0_wp/maxval(p)
    largest = 0.0_wp
    worst = 0.0_wp
    call law%find_zones(1, unit, r, p, qx, qy, dsx, dsy, zone)
    call cone_row(n, unit, mu, p, qx, qy, cut_x, cut_y)
    call law%violation(1, unit, 1.0_wp/compliance, p, qx, qy, dsx, dsy, largest, worst)
    lack = 0.0_wp
    do i = 1, n
      q = [qx(i), qy(i)]
      ds = [dsx(i), dsy(i)]
      expected = separated
      cut = 0.0_wp
      if (p(i) > 0.0_wp) then
        expected = merge(slip, stick, norm2(q - r*ds) > mu*p(i))
        cut = on_cone(q, mu*p(i))
        lack = max(lack, norm2(q - on_cone(q - ds/compliance, mu*p(i))))
      end if
      call check_true(error, zone(i) == expected, 'zone')
      if (allocated(error)) return
      call check(error, norm2(cut - [cut_x(i), cut_y(i)]), 0.0_wp, 1.0e-6_wp, 'traction on the cone [Pa]')
      if (allocated(error)) return
    end do
    call check_true(error, count(zone == separated) > 9 .and. minval(zone) < maxval(zone) - 1, 'all zones are there')
    if (allocated(error)) return
    call check(error, sqrt(worst), unit*lack, 1.0e-14_wp, 'residual')
    if (allocated(error)) return
    call check(error, sqrt(largest), unit*maxval(hypot(qx, qy), mask=p > 0.0_wp), 1.0e-14_wp, 'largest traction')
    if (allocated(error)) return
    ! without slip nothing is cut off
    call cone_row(n, unit, no_slip%slope(), p, qx, qy, cut_x, cut_y)
    call check(error, maxval(hypot(cut_x - qx, cut_y - qy), mask=p > 0.0_wp), 0.0_wp, 0.0_wp, 'no slip')

  contains

    !> Project a traction on the disc of a radius.
    pure function on_cone(traction, bound)
      real(wp), intent(in) :: traction(2), bound
      real(wp) :: on_cone(2)

      on_cone = traction*min(bound/norm2(traction), 1.0_wp)
    end function on_cone

  end subroutine test_rows

  !> A spring as soft as the node leaves half of the traction, and none leaves all; nothing becomes of nothing.
  subroutine test_springs(error)
    type(error_t), allocatable, intent(out) :: error
    real(wp), dimension(4) :: qx, qy
    real(wp), parameter :: compliance(4) = [0.0_wp, 2.0e-3_wp, 6.0e-3_wp, 2.0e-3_wp], none(4) = 0.0_wp, &
                           u(4) = [1.0_wp, 1.0_wp, 1.0_wp, 0.0_wp]

    qx = [300.0_wp, 300.0_wp, 300.0_wp, 0.0_wp]
    qy = [400.0_wp, 400.0_wp, 400.0_wp, 0.0_wp]
    call slip_compliance_row(4, compliance, u, none, qx, qy)
    call check(error, largest(qx - 300.0_wp*[1.0_wp, 0.5_wp, 0.25_wp, 0.0_wp]), 0.0_wp, 1.0e-12_wp, 'along x')
    if (allocated(error)) return
    call check(error, largest(qy - 400.0_wp*[1.0_wp, 0.5_wp, 0.25_wp, 0.0_wp]), 0.0_wp, 1.0e-12_wp, 'along y')
  end subroutine test_springs

  !> A part of no numbers at the end of shared memory has an address; bounds are checked by `make debug-check`.
  subroutine test_scratch(error)
    type(error_t), allocatable, intent(out) :: error
    type(scratch_t) :: scratch
    integer(int64), parameter :: bytes = 24
    integer :: stat

    call scratch%reserve(bytes, stat)
    call check_true(error, stat == 0 .and. address(bytes/8) - address(0_int64) == bytes, 'addresses')

  contains

    !> Return the address from a number on.
    integer(c_intptr_t) function address(after)
      integer(int64), intent(in) :: after

      address = transfer(scratch%place(after), address)
    end function address

  end subroutine test_scratch

end module test_vectors
